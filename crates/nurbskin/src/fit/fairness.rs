//! The fairness functional and its scale-free weight.
