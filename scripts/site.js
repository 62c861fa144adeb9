// Names what the theme's own script puts into a page, and lets the keyboard reach what scrolls.
(() => {
  const name = (element, words) => { if (!element.hasAttribute("aria-label")) element.setAttribute("aria-label", words); };
  const mend = () => {
    document.querySelectorAll(".md-search[role=dialog]").forEach((each) => name(each, "Search"));
    document.querySelectorAll("nav.md-code__nav").forEach((each, k) => name(each, `Code block ${k + 1}`));
    document.querySelectorAll(".md-typeset__scrollwrap, .md-typeset pre > code").forEach((each) => { if (each.tabIndex < 0) each.tabIndex = 0; });
  };
  new MutationObserver(mend).observe(document.documentElement, { childList: true, subtree: true });
  document.addEventListener("DOMContentLoaded", mend);
})();
