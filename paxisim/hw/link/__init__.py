"""Link: from a port to a queue of frames."""
