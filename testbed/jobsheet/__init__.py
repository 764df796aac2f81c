"""The job sheet: whose robot was measured, by whom, with which instrument, in which air."""
