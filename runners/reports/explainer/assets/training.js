// The page of a training needs no script but for its theme.

document.getElementById("theme").addEventListener("click", switchTheme);
recallTheme();
document.body.classList.add("ready");
