// Builds the page into one HTML file: scripts and styles stand in it, and nothing is fetched.

import { readFileSync } from "node:fs";
import { defineConfig, type Plugin } from "vite";

/** The licence of what is built in. */
const THREE = readFileSync(new URL("node_modules/three/LICENSE", import.meta.url), "utf8").trim();

const NOTICE = `<!--
The viewer of isolux, built by \`npm run build\` in viewer/; do not edit. MIT OR Apache-2.0.

It contains three.js (https://threejs.org):

${THREE}

and 33 colours each of matplotlib's viridis and inferno (CC0).
-->
`;

/** Puts the one script and the one style sheet into the page. */
function inline(): Plugin {
  return {
    name: "inline",
    enforce: "post",
    generateBundle(_, bundle) {
      const page = bundle["index.html"];
      if (page?.type !== "asset") throw new Error("there is no index.html");
      let html = String(page.source);
      for (const [name, part] of Object.entries(bundle)) {
        if (part === page) continue;
        const isScript = part.type === "chunk";
        // What would end the element early is written another way.
        const text = (isScript ? part.code : String(part.source)).trim().replaceAll("</script", "<\\/script");
        const link = new RegExp(`<(script|link)[^>]*"[^"]*${name}"[^>]*>(</script>)?\\n?`);
        if (!link.test(html)) throw new Error(`index.html does not name ${name}`);
        html = html.replace(link, "");
        html = isScript
          ? html.replace("</body>", () => `<script type="module">${text}</script>\n  </body>`)
          : html.replace("</head>", () => `<style>${text}</style>\n  </head>`);
        delete bundle[name];
      }
      page.source = html.replace("<!doctype html>\n", () => `<!doctype html>\n${NOTICE}`);
      page.fileName = "viewer.html";
    },
  };
}

export default defineConfig({
  build: {
    outDir: "../python/isolux/viewer",
    emptyOutDir: false,
    assetsDir: "",
    cssCodeSplit: false,
    modulePreload: { polyfill: false },
    target: "es2022",
    chunkSizeWarningLimit: 2000,
  },
  plugins: [inline()],
});
