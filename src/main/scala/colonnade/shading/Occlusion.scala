package colonnade.shading

import chisel3._

/** What lies between a surface and a light. */
object Occlusion extends ChiselEnum {

  /** Nothing, or no shadow ray was sent. */
  val none = Value

  /** Only triangles that let some light through. */
  val clear  = Value
  val opaque = Value
}
