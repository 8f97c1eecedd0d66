// SPDX-License-Identifier: Apache-2.0
// Returns size [px] and contrast of all letters that are shown.
() => {
  const light = (text) => {
    const parts = text.match(/[\d.]+/g).map(Number);
    if (parts.length === 4 && parts[3] === 0) return null;
    const [r, g, b] = parts.map((one) => one / 255).map((one) =>
      one <= 0.04045 ? one / 12.92 : ((one + 0.055) / 1.055) ** 2.4);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const behind = (one) =>
    one ? light(getComputedStyle(one).backgroundColor) ?? behind(one.parentElement) : 1;
  const is = (node) => node.nodeType === 3 && node.data.trim();
  const has = (one) => [...one.childNodes].some(is);
  return [...document.querySelectorAll("body *")]
    .filter((one) => one.checkVisibility() && has(one))
    .map((one) => {
      const style = getComputedStyle(one), pair = [light(style.color), behind(one)].sort();
      return { text: one.textContent.slice(0, 30), size: parseFloat(style.fontSize),
        contrast: (pair[1] + 0.05) / (pair[0] + 0.05) };
    });
}
