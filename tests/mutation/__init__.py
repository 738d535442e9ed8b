"""Mutation testing: change the code a little in many places, and count the changes that the tests detect."""
