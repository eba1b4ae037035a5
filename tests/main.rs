//! The whole program, tested from outside: one binary, laid out like its addresses.

mod api;
mod browser;
mod stories;
mod support;
