//! Training: focal-time scans, replay memory, DQN, evaluation. Knows no web.
