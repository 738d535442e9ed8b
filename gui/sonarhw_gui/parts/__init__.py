"""Small widgets and drawing functions without knowledge of sonar."""
