"""From a situation to a decision: failure rates and policies (paper, IV).

Pure, and without smach.
"""
