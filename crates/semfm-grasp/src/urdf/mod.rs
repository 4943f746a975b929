//! Robot descriptions, read behind our own limits and checks.
