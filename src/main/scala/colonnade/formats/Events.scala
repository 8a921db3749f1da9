package colonnade.formats

import chisel3._

/** Reads of the maps that are accepted in one cycle; names as in `Counters`. */
final class AttributeEvents extends Bundle {
  val albedoReads = Bool()
  val normalReads = Bool()
  val cellReads   = Bool()
  val planeReads  = Bool()
}
