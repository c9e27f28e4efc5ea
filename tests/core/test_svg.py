from pbrs_farm.core.svg import element, svg_file, svg_text


def test_words_and_attributes_are_escaped_and_empty_ones_left_out() -> None:
    root = svg_file(width=10, viewBox="0 0 1 1")
    element(root, "text", '</text><script x="&">', css="a", font_size=2, style="", fill='"')
    assert svg_text(root) == (
        '<svg xmlns="http://www.w3.org/2000/svg" width="10" viewBox="0 0 1 1">'
        '<text class="a" font-size="2" fill="&quot;">'
        '&lt;/text&gt;&lt;script x="&amp;"&gt;</text></svg>'
    )
