//! The small part of Markdown in which texts for pages are written: paragraphs, `##` headings, `-`
//! lists, tables and `**bold**`.

use std::fmt::Write as _;

use askama::filters::{Escaper as _, Html};

/// HTML to be put into a page as it is; everything in the text is escaped. A `#` heading is left
/// out: a page has one of its own.
pub(super) fn to_html(text: &str) -> String {
    let mut html = String::new();
    let blocks = text.split("\n\n").map(str::trim);
    for block in blocks.filter(|block| !block.is_empty() && !block.starts_with("# ")) {
        if let Some(heading) = block.strip_prefix("## ") {
            element(&mut html, "h2", heading);
        } else if block.starts_with("- ") {
            html.push_str("<ul>");
            for item in block.lines().filter_map(|line| line.strip_prefix("- ")) {
                element(&mut html, "li", item);
            }
            html.push_str("</ul>\n");
        } else if block.starts_with('|') {
            table(&mut html, block);
        } else {
            element(&mut html, "p", block);
        }
    }
    html
}

/// A header, a line of dashes, rows; wider than the page, it scrolls by itself.
fn table(html: &mut String, block: &str) {
    html.push_str(
        "<div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"Table\"><table>\n",
    );
    for (n, line) in block.lines().enumerate() {
        if n == 1 {
            continue; // the dashes
        }
        html.push_str("<tr>");
        for cell in line.trim().trim_matches('|').split('|') {
            element(html, if n == 0 { "th" } else { "td" }, cell.trim());
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</table></div>\n");
}

fn element(html: &mut String, tag: &str, text: &str) {
    let _ = write!(html, "<{tag}>"); // a string takes everything
    for (n, part) in text.split("**").enumerate() {
        let is_bold = n % 2 == 1;
        html.push_str(if is_bold { "<strong>" } else { "" });
        let _ = Html.write_escaped_str(&mut *html, part); // a string takes everything
        html.push_str(if is_bold { "</strong>" } else { "" });
    }
    let _ = writeln!(html, "</{tag}>"); // a string takes everything
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headings_lists_and_paragraphs_become_html_and_nothing_else_does() {
        let html = to_html("Open <it>.\n\n## When\n\n- one\n- two & three\n");
        assert_eq!(
            html,
            "<p>Open &#60;it&#62;.</p>\n<h2>When</h2>\n<ul><li>one</li>\n<li>two &#38; three</li>\n</ul>\n"
        );
    }

    #[test]
    fn tables_have_a_head_and_rows_and_bold_stays_bold() {
        let html = to_html("# Title\n\n| a | b |\n|---|---:|\n| **1** | <2> |\n");
        assert_eq!(
            html,
            "<div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"Table\"><table>\n\
             <tr><th>a</th>\n<th>b</th>\n</tr>\n<tr><td><strong>1</strong></td>\n<td>&#60;2&#62;</td>\n</tr>\n\
             </table></div>\n"
        );
    }
}
