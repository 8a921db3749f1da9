package colonnade.shading

import chisel3._

/** The outcome of a shadow ray. */
object Occlusion extends ChiselEnum {
  val none         = Value // the ray hits nothing, or no ray was sent
  val transmissive = Value // the ray hits transmissive triangles only
  val opaque       = Value
}
