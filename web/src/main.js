import { activateTables } from "./table.js";
import { activateOrgans } from "./organ.js";

activateTables(document);
activateOrgans(document);

// A link to a closed case opens it.
function openTarget() {
  const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (target instanceof HTMLDetailsElement && !target.open) {
    target.open = true;
    target.scrollIntoView();
  }
}
addEventListener("hashchange", openTarget);
openTarget();

// Paper shows every case.
let closed = [];
addEventListener("beforeprint", () => {
  closed = [...document.querySelectorAll("details.case:not([open])")];
  closed.forEach((details) => (details.open = true));
});
addEventListener("afterprint", () => closed.forEach((details) => (details.open = false)));
