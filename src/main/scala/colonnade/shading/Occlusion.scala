package colonnade.shading

import chisel3._

/** The outcome of a shadow ray. */
object Occlusion extends ChiselEnum {

  /** The ray hits nothing, or no ray was sent. */
  val none = Value

  /** The ray hits transmissive triangles only. */
  val transmissive = Value
  val opaque       = Value
}
