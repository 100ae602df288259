"""What is known without sampling: error covariances, generalised least squares, Fisher bounds."""
