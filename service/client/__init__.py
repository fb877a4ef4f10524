"""What other programs import: press, wait for faces, follow what is published."""
