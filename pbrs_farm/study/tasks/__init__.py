"""What each of the three tasks is: its target, loss, prediction, score and baseline."""
