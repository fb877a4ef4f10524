"""Commands about captures that the hub keeps: fetch one, list them."""
