"""Small widgets and drawing functions that are not specific to sonar."""
