package colonnade.unit

import chisel3.UInt
import chisel3.util.DecoupledIO
import chiseltest._
import colonnade.Packed
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Pixel, UnitPosition}
import org.scalatest.Assertions._

import scala.util.Random

/** Gives a path unit or a path tracer the positions of a frame without an environment, in any order, and takes its
  * pixels.
  *
  * @param pixel the bits of `pixels`
  */
final class PathDriver(
    config:    ColonnadeConfig,
    positions: DecoupledIO[UnitPosition],
    pixels:    DecoupledIO[Pixel],
    pixel:     UInt,
    events:    PathEvents,
    random:    Random
) {
  private val layout  = new Packed(new Pixel(config))
  private val counted = Seq("hits", "raysShadow", "raysReflection", "raysRefraction")

  /** Sums of the events. */
  val counts = scala.collection.mutable.Map.from(counted.map(_ -> 0))

  /** @param willing probability that a port is ready or valid in a cycle
    * @param around  what drives the other ports in a cycle
    * @param step    ends a cycle
    * @return positions and values of the pixels in order of time
    */
  def run(frame: SmallFrame, willing: Double)(around: => Unit)(
      step: => Unit
  ): Seq[((Int, Int), Map[String, BigInt])] = {
    def isWilling = random.nextDouble() < willing
    var left      = random.shuffle(frame.positions)
    var offers    = false
    var found     = Vector.empty[((Int, Int), Map[String, BigInt])]
    var idle      = 0
    while (found.size < frame.positions.size || idle < 20) {
      offers = left.nonEmpty && (offers || isWilling)
      positions.valid.poke(offers)
      for ((x, y) <- left.headOption) {
        positions.bits.x.poke(x)
        positions.bits.y.poke(y)
      }
      val accepts = isWilling
      pixels.ready.poke(accepts)
      around
      idle += 1
      assert(idle < 8000, s"nothing happens after ${found.size} pixels")
      for (name <- counted) counts(name) += events.elements(name).asInstanceOf[UInt].peekInt().toInt
      if (accepts && pixels.valid.peekBoolean()) {
        val values = layout.unpack(pixel.peekInt())
        found :+= (values("x").toInt, values("y").toInt) -> (values - "x" - "y")
        idle = 0
      }
      if (offers && positions.ready.peekBoolean()) {
        left = left.tail
        offers = false
      }
      step
    }
    found
  }
}
