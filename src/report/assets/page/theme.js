'use strict';
// Colours: as the system has them, light or dark.
(() => {
  const theme = document.querySelector('button.theme');
  const names = { auto: ['Auto', 'as the system has them'], light: ['Light', 'light'], dark: ['Dark', 'dark'] };
  const root = document.documentElement;
  const showTheme = () => {
    const [text, words] = names[root.dataset.theme || 'auto'];
    theme.querySelector('span').textContent = text;
    theme.setAttribute('aria-label', `Colours: ${words}`);
  };
  theme.addEventListener('click', () => {
    const order = ['auto', 'light', 'dark'];
    const next = order[(order.indexOf(root.dataset.theme || 'auto') + 1) % order.length];
    if (next === 'auto') delete root.dataset.theme;
    else root.dataset.theme = next;
    try {
      localStorage.setItem('lightprobe-theme', next);
    } catch { /* no storage: forgotten with the page */ }
    showTheme();
  });
  showTheme();
})();
