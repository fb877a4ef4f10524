"""What moves a visit along: pages, the hub and the clock in, and what a visit wants done out."""
