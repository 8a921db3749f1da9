package colonnade.formats

import chisel3._

/** Three components, one per axis; `x` is the most significant. */
final class Vec3[T <: Data](private val component: T) extends Bundle {
  val x = component.cloneType
  val y = component.cloneType
  val z = component.cloneType

  def axes: Seq[T] = Seq(x, y, z)
}

object Vec3 {
  def apply[T <: Data](component: T): Vec3[T] = new Vec3(component)

  /** A wire with these components. */
  def of[T <: Data](components: Seq[T]): Vec3[T] = {
    val vector = Wire(new Vec3(chiselTypeOf(components.head)))
    vector.axes.zip(components).foreach { case (to, from) => to := from }
    vector
  }

  def of[T <: Data](x: T, y: T, z: T): Vec3[T] = of(Seq(x, y, z))
}

/** Red, green and blue; `r` is the most significant. */
final class Rgb[T <: Data](private val channel: T) extends Bundle {
  val r = channel.cloneType
  val g = channel.cloneType
  val b = channel.cloneType

  def channels: Seq[T] = Seq(r, g, b)
}

object Rgb {
  def apply[T <: Data](channel: T): Rgb[T] = new Rgb(channel)
}
