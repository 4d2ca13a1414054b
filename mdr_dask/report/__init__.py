"""The report on studies (one HTML file that needs no network), and the zip of a study for publication."""
