"""`colonnade view`: a scene in a page of the browser, rendered by the model (docs/browser.md)."""
