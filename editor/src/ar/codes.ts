/** The codes of the ArUco dictionaries 4x4_50, 4x4_100 and 4x4_250, which are beginnings of one list. */

/** 16 bits per marker in hexadecimal: the cells row by row, 1 is white. A test compares them with OpenCV. */
const CODES =
  "b5320f9a332d9946549e79cd9e2ec4f2fedacf56f99111a70eb72a0f24b1263e466566006c5e76af868bb02bccd5dd82fe47" +
  "9471ace4a5542123346f441557b29ecff0cb08ae0929187504ff0df61c5a17182a28328c38b224e82eeb2d3f4b64502e5013" +
  "519455685d415f9768016867612461e96b126fe567df7e1b80a083448ba2937a846c852a859c9c899fa1bb7cbc04b65bbfc8" +
  "b7abca1fc962d958d3d5cc98c7a0c537e95df925fbbbee2af74d35758aad76170acf064b2dc149d843f44f364fd369e470c7" +
  "7a6eb4eaed4ffce7fea6002500430a880a86026f001c009708370a3109c60b0109fb0b581082182d10781073127412b11af9" +
  "13060c0e0cf104330c9f0ef20efd074c0fa4072f05b50f9107db1ee414391d8015c81f8b15ba1db1208028e922a228532af0" +
  "22f72940214629b92b9c2bb238ca382e300738e73a493a65325d3b88391d3bd3264727802faa2d1425de25532f7734483ca8" +
  "3c41340d34fb369a3de0356a3d093ded3fc43f6c37ce3d5c3d7637b03f173fff48e542684a2d4160495141dd4bdf584f5a48" +
  "5816505d5afa5ab551235b8a591951354c6946c14e0b445f4e594d834d7d47d847735c855e44562b5cbb55c35f6e5feb5d12" +
  "555e6270621561c26b2063456b5c6b5b780c7acf787f798071e5717479b671d37b33646a66a86ea76e9165226dcb678d6d31";

const SIZES: Readonly<Record<string, number>> = { "4x4_50": 50, "4x4_100": 100, "4x4_250": 250 };

/** Return whether AR detects markers of a dictionary. */
export const isSupported = (dictionary: string): boolean => dictionary in SIZES;

/** Return the codes of markers by id. Ids that the dictionary does not contain are left out. */
export function codesOf(dictionary: string, ids: Iterable<number>): Map<number, number> {
  const size = SIZES[dictionary] ?? 0;
  const codes = new Map<number, number>();
  for (const id of ids) {
    if (id >= 0 && id < size) codes.set(id, Number.parseInt(CODES.slice(4 * id, 4 * id + 4), 16));
  }
  return codes;
}
