//! The pose and scale of a reconstruction in an observed partial cloud: a robust Sim(3).
