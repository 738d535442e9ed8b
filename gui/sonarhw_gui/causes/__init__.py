"""The search for causes of misfits, and the panel that lists them."""
