"""What smach_oracle and the stand-ins for upstream's packages share: actions, introspection.

It imports neither of them, and is installed wherever smach_oracle is.
"""
