"""Reference: a magnetic pad from first principles, as a stand-in for a real sensor."""
