//! A figure's bytes as its file's ending asks: SVG as it is, PNG with a font of its own.

use std::path::Path;
use std::sync::Arc;

use anyhow::Context as _;
use resvg::tiny_skia::{FilterQuality, Pixmap, PixmapPaint, Transform};
use resvg::usvg::{self, fontdb};

use crate::cli::BadInput;

/// What a figure is written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::cli) enum Format {
    /// Text, drawn by the reader with the reader's fonts.
    Svg,
    /// Pixels.
    Png,
}

impl Format {
    /// By a file's ending.
    ///
    /// # Errors
    /// [`BadInput`] for any other.
    pub(in crate::cli) fn of(path: &Path) -> Result<Self, BadInput> {
        match path.extension().and_then(|ending| ending.to_str()) {
            Some("svg") => Ok(Self::Svg),
            Some("png") => Ok(Self::Png),
            _ => Err(BadInput(format!(
                "{} must end in .svg or .png",
                path.display()
            ))),
        }
    }
}

/// The bytes of the file. A PNG has `scale` pixels for each unit of the figure.
///
/// # Errors
/// When the figure is larger than a picture can be.
pub(in crate::cli) fn encode(svg: String, format: Format, scale: f32) -> anyhow::Result<Vec<u8>> {
    if format == Format::Svg {
        return Ok(svg.into_bytes());
    }
    let options = usvg::Options {
        fontdb: Arc::new(fonts()),
        ..usvg::Options::default()
    };
    let tree = usvg::Tree::from_str(&svg, &options).context("cannot read the figure back")?;
    let pixels = |length: f32| (length * scale).ceil() as u32;
    let (width, height) = (pixels(tree.size().width()), pixels(tree.size().height()));
    let mut picture = Pixmap::new(width, height)
        .with_context(|| format!("a picture of {width} × {height} pixels is too large"))?;
    let transform = Transform::from_scale(scale, scale);
    resvg::render(&tree, transform, &mut picture.as_mut());
    draw_pictures(tree.root(), transform, &mut picture)?;
    picture.encode_png().context("cannot encode the picture")
}

/// Pictures inside a figure, on top of the rest. resvg leaves them out unless it is built with
/// decoders of four formats; a figure has PNG alone.
fn draw_pictures(
    group: &usvg::Group,
    transform: Transform,
    picture: &mut Pixmap,
) -> anyhow::Result<()> {
    for node in group.children() {
        match node {
            usvg::Node::Group(group) => draw_pictures(group, transform, picture)?,
            usvg::Node::Image(image) => {
                let usvg::ImageKind::PNG(bytes) = image.kind() else {
                    anyhow::bail!("a picture inside the figure is no PNG");
                };
                let inner = Pixmap::decode_png(bytes).context("a picture inside the figure")?;
                let paint = PixmapPaint {
                    quality: FilterQuality::Bilinear,
                    ..PixmapPaint::default()
                };
                let place = transform.pre_concat(image.abs_transform());
                picture.draw_pixmap(0, 0, inner.as_ref(), &paint, place, None);
            }
            usvg::Node::Path(_) | usvg::Node::Text(_) => {}
        }
    }
    Ok(())
}

/// The bundled font and no other: the same pixels on every machine.
fn fonts() -> fontdb::Database {
    let mut fonts = fontdb::Database::new();
    fonts.load_font_data(
        include_bytes!("../../../../../assets/fonts/SourceSans3-Regular.ttf").to_vec(),
    );
    fonts.load_font_data(
        include_bytes!("../../../../../assets/fonts/SourceSans3-SemiBold.ttf").to_vec(),
    );
    fonts.set_sans_serif_family("Source Sans 3");
    fonts
}

#[cfg(test)]
mod tests {
    use super::*;

    const WORDS: &str = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"80\" height=\"20\" font-family=\"sans-serif\">\
        <text x=\"2\" y=\"15\" font-size=\"14\">Δ − σ₀ ≥ 5 %</text></svg>";

    #[test]
    fn words_are_drawn_with_the_bundled_font_the_same_each_time() {
        let png = encode(WORDS.into(), Format::Png, 2.0).unwrap();
        assert_eq!(encode(WORDS.into(), Format::Png, 2.0).unwrap(), png);
        let picture = Pixmap::decode_png(&png).unwrap();
        assert_eq!((picture.width(), picture.height()), (160, 40));
        let n_inked = picture.pixels().iter().filter(|p| p.alpha() > 128).count();
        assert!(n_inked > 200, "{n_inked} pixels of ink");
    }

    #[test]
    fn a_picture_inside_a_figure_is_drawn_where_it_stands() {
        use base64::Engine as _;
        let mut red = Pixmap::new(4, 3).unwrap();
        red.fill(resvg::tiny_skia::Color::from_rgba8(200, 0, 0, 255));
        let bytes = base64::engine::general_purpose::STANDARD.encode(red.encode_png().unwrap());
        let svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"40\" height=\"20\">\
             <image x=\"10\" y=\"5\" width=\"12\" height=\"9\" href=\"data:image/png;base64,{bytes}\"/></svg>"
        );
        let png = encode(svg, Format::Png, 2.0).unwrap();
        let picture = Pixmap::decode_png(&png).unwrap();
        let is_red = |x, y| picture.pixel(x, y).unwrap().red() > 190;
        assert!(is_red(22, 12) && is_red(42, 26), "its corners");
        assert!(
            !is_red(17, 12) && !is_red(46, 26) && !is_red(30, 30),
            "and no more"
        );
    }

    #[test]
    fn both_weights_are_found_under_the_generic_name() {
        let fonts = fonts();
        for weight in [fontdb::Weight::NORMAL, fontdb::Weight::SEMIBOLD] {
            let query = fontdb::Query {
                families: &[fontdb::Family::SansSerif],
                weight,
                ..fontdb::Query::default()
            };
            let face = fonts.face(fonts.query(&query).unwrap()).unwrap();
            assert_eq!(face.weight, weight);
        }
    }

    #[test]
    fn other_endings_are_refused() {
        let told = Format::of(Path::new("figure.pdf")).unwrap_err().to_string();
        assert!(told.contains(".svg or .png"), "{told}");
    }
}
