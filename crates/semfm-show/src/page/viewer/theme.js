// Light or dark: as the system says, until the reader chooses. The choice is kept where the browser
// lets a page keep something.

const THEME_KEY = "semfm-theme";

function keptTheme() {
  try { return localStorage.getItem(THEME_KEY); } catch { return null; }
}

// Keeps a choice, or none.
function keepTheme(theme) {
  try {
    if (theme) localStorage.setItem(THEME_KEY, theme); else localStorage.removeItem(THEME_KEY);
  } catch { /* a page from a file may keep nothing */ }
}

function startTheme(switchButton) {
  const system = matchMedia("(prefers-color-scheme: dark)"), root = document.documentElement;
  const ofSystem = () => system.matches ? "dark" : "light", shown = () => root.dataset.theme || ofSystem();
  const label = () => { switchButton.textContent = shown() === "dark" ? "light page" : "dark page"; };
  const kept = keptTheme();
  if (kept === "dark" || kept === "light") root.dataset.theme = kept;
  switchButton.addEventListener("click", () => {
    const wanted = shown() === "dark" ? "light" : "dark";
    if (wanted === ofSystem()) delete root.dataset.theme; else root.dataset.theme = wanted;
    keepTheme(root.dataset.theme);
    label();
  });
  system.addEventListener("change", label);
  switchButton.hidden = false;
  label();
}
