"""What a live sensor needs and no driver gives: clocks, memory, pairs, states; pure."""
