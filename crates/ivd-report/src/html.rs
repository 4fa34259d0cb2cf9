//! Text, numbers, colours and pictures for a page.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

/// Text that is neither markup nor acts on the display.
pub fn escape(text: &str) -> String {
    ivd_core::shown(text)
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('\'', "&#39;")
        .replace('"', "&quot;")
}

/// Three digits that say something.
pub fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        return "0".to_owned();
    }
    if !(1e-3..1e6).contains(&size) {
        return format!("{value:.2e}");
    }
    let places = (2 - size.log10().floor() as i32).clamp(0, 6) as usize;
    let text = format!("{value:.places$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A colour of sRGB as CSS writes it.
pub fn css_colour([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// The bytes of a PNG file, packed into the address of an image.
pub fn png_url(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(png))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_can_neither_be_markup_nor_act_on_the_display() {
        assert_eq!(escape("<b>\u{202e}&\u{1b}\n"), "&lt;b&gt;\\u{202e}&amp;\\u{1b}\n");
        assert_eq!(escape("<a 'b' \"c\">"), "&lt;a &#39;b&#39; &quot;c&quot;&gt;");
    }

    #[test]
    fn numbers_keep_three_digits() {
        let told = [0.0, 0.012_34, 1.0, 1.25, 12.3, 127.5, 1234.0].map(number);
        assert_eq!(told, ["0", "0.0123", "1", "1.25", "12.3", "128", "1234"]);
        assert_eq!([-0.004_12, 0.001_234, 1.2e-7].map(number), ["-0.00412", "0.00123", "1.20e-7"]);
    }
}
