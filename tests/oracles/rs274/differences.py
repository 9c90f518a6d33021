"""What is decided to be otherwise than in LinuxCNC."""

# The programs, the outcome, what is said of them, and why.
DIFFERENCES = [
]
