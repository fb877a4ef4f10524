"""The messages as data: what they hold and how they are written on the wire.

Its modules are imported by name: who needs a topic or a role loads no arrays.
"""
