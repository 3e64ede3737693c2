"""`make bench`: accuracy and speed of the estimator over random scenes, beside what the bound allows."""
