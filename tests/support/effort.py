"""How much is searched where one start leads to the motion that a test is about."""

QUICK = {"effort": "single", "least_motion": False}
"""The ``search`` part of a task, or keywords of `brachis.plan`."""
