"""Board profiles that ship with the product."""
