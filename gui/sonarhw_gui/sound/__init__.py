"""Sound played along its paths: the control of time, and the bar below the views."""
