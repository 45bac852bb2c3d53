'use strict';
// Before anything is painted: scripts run, and which colours were chosen.
document.documentElement.className = 'scripts';
try {
  const theme = localStorage.getItem('lightprobe-theme');
  if (theme === 'light' || theme === 'dark') document.documentElement.dataset.theme = theme;
} catch { /* no storage: the system's colours */ }
