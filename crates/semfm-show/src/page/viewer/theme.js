// Light or dark: as the system says, until the reader chooses. The choice is kept where the browser
// lets a page keep something.

const THEME_KEY = "semfm-theme";

function keptTheme() {
  try { return localStorage.getItem(THEME_KEY); } catch { return null; }
}

function keepTheme(theme) {
  try { localStorage.setItem(THEME_KEY, theme); } catch { /* a page from a file may keep nothing */ }
}

function startTheme(switchButton) {
  const system = matchMedia("(prefers-color-scheme: dark)"), root = document.documentElement;
  const shown = () => root.dataset.theme || (system.matches ? "dark" : "light");
  const label = () => { switchButton.textContent = shown() === "dark" ? "light page" : "dark page"; };
  const kept = keptTheme();
  if (kept === "dark" || kept === "light") root.dataset.theme = kept;
  switchButton.addEventListener("click", () => {
    root.dataset.theme = shown() === "dark" ? "light" : "dark";
    keepTheme(root.dataset.theme);
    label();
  });
  system.addEventListener("change", label);
  switchButton.hidden = false;
  label();
}
