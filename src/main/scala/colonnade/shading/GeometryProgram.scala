package colonnade.shading

import chisel3._
import colonnade.microcode.{Label, Microprogram, Overlap, Repeat, StepEncoding}

/** Labels of [[GeometryProgram]]. */
sealed trait GeometryLabel extends Label

object GeometryLabel {
  case object Idle       extends GeometryLabel // waits for a hit
  case object Normal     extends GeometryLabel // interpolates the shading normal
  case object Point      extends GeometryLabel // computes the hit point and the shadow rays' origin
  case object LightAngle extends GeometryLabel // computes the direction to a light, and its angle to the normal
  case object Done       extends GeometryLabel // offers the result
}

/** Inputs of [[GeometryProgram]]. */
final class GeometryConditions {
  val takes:        Bool = Wire(Bool()) // a hit is taken
  val startsOver:   Bool = Wire(Bool()) // the smooth normal is zero: start over with the geometric one
  val isFirstLight: Bool = Wire(Bool()) // the hit's first light; further ones find the normal scaled and measured

  /** The result is taken, and whether it is of the hit's last light. */
  val isTaken: Bool = Wire(Bool())
  val isLast:  Bool = Wire(Bool())
}

/** The shader geometry's microprogram.
  *
  * {{{
  * multiplier | weights × normals | shear × t | offset × normal |    | n·n |     | n·l | l·l |     | norms |
  * adder      |       n and |n|   |           P +=       P +=   |  l = light - P   |l| |
  * shifter    |                                               | light <<  |n <<|   | l << | l << |
  * }}}
  * The product of a step is accumulated `productLatency` steps later, here in the next one. The sum is ready a step
  * after that, and its rounded value two steps after.
  */
final class GeometryProgram(
    formats:        ShaderFormats,
    control:        GeometryControl,
    conditions:     GeometryConditions,
    productLatency: Int = 1
) {
  import GeometryLabel._
  import conditions._

  private val sumLatency   = productLatency + 1
  private val roundLatency = productLatency + 2
  private val digits       = formats.shearDigits

  val program = new Microprogram[GeometryLabel](StepEncoding.Binary())
  import program.{branch, raise, raiseEarly}

  private def xyz(first: Int): Range = first until first + 3

  // The schedule, in cycles of the overlapped part. Three products make a component of the normal
  private val weighted         = 0 until 9
  private val shiftInNormal    = Seq(2, 5, 8).map(_ + sumLatency)
  private val latchNormalZeros = shiftInNormal.last + 1

  // The hit point. Nothing is added to it before the normal is measured: until then the program may start over
  private val shear       = Seq(0, 1).map(side => (0 until digits).map(weighted.length + side * digits + _))
  private val addShear    = shear.map(_.last + roundLatency)
  private val addDistance = addShear.last + 1
  private val unpermute   = Seq(addDistance + 1, addDistance + 2)
  private val addOffset   = xyz(unpermute.last + 1)
  private val scaleOffset = addOffset.map(_ - roundLatency)
  require(addShear.head > latchNormalZeros, "the hit point changes while the program may start over")

  // The vector to the light, and its largest component
  private val shiftInLight    = xyz(addOffset.last + 1)
  private val alignLight      = shiftInLight.map(_ - 1)
  private val measureLight    = xyz(shiftInLight.last + 1)
  private val latchLightZeros = measureLight.last + 1

  // Dot products of the scaled vectors. The shifter is a step ahead of the multiplier
  private val scaleNormal = xyz(alignLight.last + 1)
  private val scaleLight  = Seq(xyz(latchLightZeros + 1), xyz(latchLightZeros + 4))
  private val normProduct = scaleLight.last.last + 1 + sumLatency
  require(
    shiftInLight.head > addOffset.last && scaleNormal.head > alignLight.head,
    "a light begins within the hit's part"
  )

  program.exclusive("multiplier", control.products)
  program.exclusive("adder", control.additions)
  program.exclusive("shifter", control.shifts)

  program.step(Idle) {
    raise(control.load, takes)
    program.await(takes, "request")
  }
  program.overlap { at =>
    at.label(0, Normal)
    at.label(latchNormalZeros + 1, Point)
    at.label(alignLight.head, LightAngle)
    normal(at)
    point(at)
    light(at)
    angle(at)
  }
  program.step(Done) {
    branch(Repeat.until(isTaken, "the result is taken"), Idle.when(isLast, "last light"), LightAngle.otherwise)
  }

  private def normal(at: Overlap[GeometryLabel]): Unit = {
    for (cycle <- weighted) at(cycle)(raiseEarly(control.weightNormal(cycle % 3)))
    weighted.grouped(3).foreach(sum(at, _))
    shiftInNormal.foreach(at(_)(raise(control.shiftInNormal)))
    at(shiftInNormal.head)(raise(control.startMeasure))
    at(latchNormalZeros) {
      raise(control.latchNormalZeros)
      branch(Normal.when(startsOver, "the smooth normal is zero"))
    }
  }

  private def point(at: Overlap[GeometryLabel]): Unit = {
    for ((cycle, digit) <- shear.flatten.zipWithIndex) at(cycle)(raiseEarly(control.scaleShear(digit)))
    for (cycles <- shear) {
      sum(at, cycles)
      cycles.tail.foreach(cycle => at(cycle + productLatency)(raise(control.shiftAccumulator)))
    }
    for (cycle <- addShear) {
      at(cycle - 1)(raise(control.roundShear))
      at(cycle)(raise(control.addShear))
    }
    at(addDistance)(raise(control.addDistance))
    for ((cycle, rotation) <- unpermute.zipWithIndex) at(cycle)(raise(control.unpermute(rotation)))
    for (cycle <- scaleOffset) {
      at(cycle)(raiseEarly(control.scaleOffset))
      sum(at, Seq(cycle))
    }
    addOffset.foreach(at(_)(raise(control.addOffset, isFirstLight)))
  }

  private def light(at: Overlap[GeometryLabel]): Unit = {
    for ((cycle, axis) <- alignLight.zipWithIndex) at(cycle)(raise(control.alignLight(axis)))
    shiftInLight.foreach(at(_)(raise(control.shiftInLight)))
    measureLight.foreach(at(_)(raise(control.measureLight)))
    at(measureLight.head)(raise(control.startMeasure))
    at(latchLightZeros)(raise(control.latchLightZeros))
  }

  private def angle(at: Overlap[GeometryLabel]): Unit = {
    // n·n
    scaleNormal.foreach { cycle =>
      at(cycle)(raise(control.scaleNormal, isFirstLight))
      at(cycle + 1)(raiseEarly(control.squareNormal))
    }
    sum(at, scaleNormal.map(_ + 1))
    at(scaleNormal.last + 1 + sumLatency)(raise(control.latchNormalLength, isFirstLight))

    // n·l and l·l
    for ((cycles, product) <- scaleLight.zip(Seq(control.projectNormal, control.square))) {
      cycles.foreach { cycle =>
        at(cycle)(raise(control.scaleLight))
        at(cycle + 1)(raiseEarly(product))
      }
      sum(at, cycles.map(_ + 1))
    }
    at(scaleLight.head.last + 1 + sumLatency)(raise(control.latchDot))
    at(normProduct)(raiseEarly(control.normProduct))
    sum(at, Seq(normProduct))
  }

  /** Sums up the products of these cycles, each when it comes. */
  private def sum(at: Overlap[GeometryLabel], products: Seq[Int]): Unit = {
    products.foreach(cycle => at(cycle + productLatency)(raise(control.accumulate)))
    at(products.head + productLatency)(raise(control.startSum))
  }
}
