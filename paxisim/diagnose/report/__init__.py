"""Report: a diagnosis as one HTML page of pictures; `paxisim.diagnose.Diagnosis.report` is the front.

`page` puts the page together; each other module draws one kind of picture. Needs matplotlib and jinja2 (the
``diagnose`` extra), but no display, no pyplot and no browser.
"""
