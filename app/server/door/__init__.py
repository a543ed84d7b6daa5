"""Who comes in from a browser, at what rate, and which session it is shown."""
