"""A visit as a state machine: events and the time in, effects and a screen out; nothing waits."""
