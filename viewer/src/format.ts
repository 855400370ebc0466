// Numbers as people read them.

/** Three or four digits, thousands apart, no exponent where it can be helped. */
export function number(value: number, digits = 4): string {
  if (value === 0) return "0";
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size >= 1e7 || size < 1e-4) return value.toExponential(2).replace("e+", "e");
  const decimals = Math.max(0, digits - 1 - Math.floor(Math.log10(size)));
  const text = Number(value.toPrecision(digits)).toLocaleString("en", {
    maximumFractionDigits: Math.min(decimals, 12),
    minimumFractionDigits: Math.min(decimals, 12),
    useGrouping: size >= 1e4,
  });
  return text;
}

/** A round number without zeros at its end, for legends. */
export function short(value: number): string {
  if (value !== 0 && (Math.abs(value) >= 1e6 || Math.abs(value) < 1e-3)) return value.toExponential().replace("e+", "e");
  return value.toLocaleString("en", { maximumSignificantDigits: 6, useGrouping: Math.abs(value) >= 1e4 });
}

export function count(value: number): string {
  return value.toLocaleString("en");
}

export function percent(share: number): string {
  return `${number(100 * share, share < 0.1 ? 2 : 3)} %`;
}

export function seconds(value: number): string {
  return value < 1 ? `${number(1000 * value, 3)} ms` : `${number(value, 3)} s`;
}

export function bytes(value: number): string {
  return value < 1e6 ? `${Math.ceil(value / 1e3)} kB` : `${number(value / 1e6, 3)} MB`;
}
