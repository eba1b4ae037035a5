//! A small plotting core: figures as SVG text, the same bytes every time.
//!
//! Lengths are pixels from the top left. Colour never stands alone: a series also has its own
//! dashes and marker.

mod layout;
mod panel;
mod scale;
mod style;
mod svg;

pub(crate) use layout::{Entry, Sheet};
pub(crate) use panel::{Frame, Labels, Panel};
pub(crate) use scale::Scale;
pub(crate) use style::{INK, N_COLORS, NAME, PAPER, SMALL, series, shade};
pub(crate) use svg::{Anchor, Font, Pen, Svg};
