"""A container's image is tried: `script/image`."""
