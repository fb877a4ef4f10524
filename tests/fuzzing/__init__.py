"""Inputs that nobody sends by mistake: valid messages, broken in ways that know their structure."""
