"""The room from its scans: walls and posts that explain all echoes, ghost echoes and silence included."""
