'use strict';
// The inverse of pack.rs and codes.rs, and the tone curve of image/tonemap.rs.
const codec = (() => {
  const constants = document.body.dataset;
  const perOctave = +constants.perOctave, offset = +constants.offset, perAsinh = +constants.perAsinh;
  const INFINITE = +constants.infinite, NAN = +constants.nan;

  const bytesOf = (text) => {
    const binary = atob(text.trim());
    const bytes = new Uint8Array(binary.length);
    for (let i = 0; i < bytes.length; i++) bytes[i] = binary.charCodeAt(i);
    return bytes;
  };

  const inflate = async (bytes) => {
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  };

  // One plane: low and high bytes of residuals, added to the median prediction.
  const plane = (bytes, low, high, width, height) => {
    const codes = new Int16Array(width * height);
    for (let y = 0, i = 0; y < height; y++) {
      let left = 0, corner = 0;
      for (let x = 0; x < width; x++, i++) {
        const upper = y > 0 ? codes[i - width] : 0;
        const least = left < upper ? left : upper, most = left < upper ? upper : left;
        const predicted = corner >= most ? least : corner <= least ? most : left + upper - corner;
        const folded = bytes[low + i] | (bytes[high + i] << 8);
        codes[i] = predicted + ((folded >> 1) ^ -(folded & 1));
        left = codes[i];
        corner = upper;
      }
    }
    return codes;
  };

  const planes = async (text, count, width, height) => {
    const bytes = await inflate(bytesOf(text));
    const size = width * height;
    if (bytes.length !== 2 * count * size) throw new Error('the picture in this page is damaged');
    return Array.from({ length: count }, (_, p) => plane(bytes, p * size, (count + p) * size, width, height));
  };

  const isFinite = (code) => Math.abs(code) < INFINITE;

  const radiance = (code) => {
    const magnitude = Math.abs(code);
    if (code === NAN) return NaN;
    if (magnitude === INFINITE) return code < 0 ? -Infinity : Infinity;
    return magnitude === 0 ? 0 : Math.sign(code) * 2 ** ((magnitude - offset) / perOctave);
  };

  const difference = (code, scale) => (code === NAN ? NaN : Math.sinh(code / perAsinh) * scale);

  const srgb = (linear) => (linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055);

  // Narkowicz's fit of the ACES curve; saturated long before 16.
  const tone = (value) => {
    const x = value > 0 ? Math.min(value, 16) : 0;
    return Math.min(1, (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14));
  };

  // The byte that shows each code at this exposure, at 32768 + code.
  const developed = (exposure, isDisplay) => {
    const bytes = new Uint8Array(65536);
    if (isDisplay) {
      for (let code = 0; code < 256; code++) bytes[32768 + code] = code;
      return bytes;
    }
    const gain = 2 ** exposure;
    for (let code = 1; code < INFINITE; code++) {
      // Once white, always white.
      const white = code > 1 && bytes[32767 + code] === 255;
      bytes[32768 + code] = white ? 255 : Math.round(255 * srgb(tone(radiance(code) * gain)));
    }
    return bytes;
  };

  return { bytesOf, inflate, planes, radiance, difference, developed, isFinite, NAN };
})();
