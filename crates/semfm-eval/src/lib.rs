//! Evaluation of transfers: datasets, methods, statistics, tables and the report.
