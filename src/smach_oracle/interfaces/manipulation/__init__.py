"""A person drives the arm in six degrees of freedom."""
