package colonnade.shading

import chisel3._
import chisel3.util.log2Ceil

/** What the geometry datapath does in one cycle. Registers that nothing here names keep their values. */
final class GeometryControl(formats: ShaderFormats) extends Bundle {
  val load = Bool()

  // Factors of a product: at most one of these
  val weighted = Vec(3, Bool())
  val slope    = Vec(2 * formats.slopeDigits, Bool())
  val raise    = Bool()
  val square   = Bool()
  val project  = Bool()
  val lengths  = Bool()

  // The sum: of products, from the first one; with `descend` the sum so far moves down by a digit
  val accumulate = Bool()
  val first      = Bool()
  val descend    = Bool()

  /** The sum to round is of a slope's digits, otherwise of a normal's component. */
  val roundSlope = Bool()

  // The adder: at most one of these
  val addSlope     = Bool()
  val addDistance  = Bool()
  val addOffset    = Bool()
  val pushNormal   = Bool()
  val pushLight    = Bool()
  val measureLight = Bool()

  /** Turn the point from the ray's frame towards the object's, if its axis needs that: always, or for axis 0 only. */
  val turn = Vec(2, Bool())

  // The shifter: at most one of these
  val placeLight  = Vec(3, Bool())
  val scaleNormal = Bool()
  val scaleLight  = Bool()

  // The largest magnitude
  val startMeasure = Bool()
  val countNormal  = Bool()
  val countLight   = Bool()

  // Results
  val keepNormalLength = Bool()
  val keepDot          = Bool()
}

/** The geometry's microprogram: which step does what, one step a cycle.
  *
  * {{{
  * multiplier | weights × normals | slopes × t | offset × normal |     | n·n |     | n·l | l·l |     | lengths |
  * adder      |       n and |n|   |            P +=       P +=   |  l = light - P   |l| |
  * shifter    |                                               | light <<  |n <<|   | l << | l << |
  * }}}
  * Products of step s reach the sum in s + 1; the sum is there to use in s + 2, its rounded value in s + 3.
  */
final class GeometryProgram(formats: ShaderFormats) {
  private val toSum     = 2
  private val toRounded = 3
  private val digits    = formats.slopeDigits

  private def three(first: Int): Range = first until first + 3

  // The shading normal: for each axis three products, then the sum is pushed and measured
  private val weighted    = 0 until 9
  private val pushNormal  = Seq(2, 5, 8).map(_ + toSum)
  private val countNormal = pushNormal.last + 1

  // The hit point. Nothing is added to it before the normal is counted: then the program may still start over
  private val slopes      = Seq(0, 1).map(side => (0 until digits).map(weighted.length + side * digits + _))
  private val addSlope    = slopes.map(_.last + toRounded)
  private val addDistance = addSlope.last + 1
  private val turn        = Seq(addDistance + 1, addDistance + 2)
  require(addSlope.head > countNormal, "the hit point changes while the program may start over")

  // The shadow ray's origin
  private val addOffset = three(turn.last + 1)
  private val raise     = addOffset.map(_ - toRounded)

  // The way to the light, and its measure
  private val pushLight    = three(addOffset.last + 1)
  private val placeLight   = pushLight.map(_ - 1)
  private val measureLight = three(pushLight.last + 1)
  private val countLight   = measureLight.last + 1

  // Dot products of the scaled vectors: the shifter is a step ahead of the multiplier
  private val scaleNormal   = three(placeLight.last + 1)
  private val squareNormal  = scaleNormal.map(_ + 1)
  private val normalSquared = squareNormal.last + toSum
  private val scaleLight    = three(countLight + 1) ++ three(countLight + 4)
  private val project       = scaleLight.take(3).map(_ + 1)
  private val projected     = project.last + toSum
  private val squareLight   = scaleLight.drop(3).map(_ + 1)
  private val lengths       = squareLight.last + toSum

  /** All is done: nothing happens in this step. */
  val last: Int = lengths + toSum

  /** Where the next light of the same hit begins. */
  val nextLight: Int = placeLight.head
  require(pushLight.head > addOffset.last && scaleNormal.head > placeLight.head, "a light begins within the hit's part")

  val stepBits: Int = log2Ceil(last + 1)

  /** Decodes a step; a later light of the same hit finds its normal scaled and measured. */
  def control(step: UInt, load: Bool, isFirstLight: Bool): GeometryControl = {
    def in(steps: Seq[Int]): Bool = steps.map(step === _.U).reduce(_ || _)
    def at(steps: Int*): Bool     = in(steps)

    val sums = Seq(three(0), three(3), three(6)) ++ slopes ++ raise.map(Seq(_)) :+ squareNormal :+ project :+
      squareLight :+ Seq(lengths)
    val control = Wire(new GeometryControl(formats))
    control.load := load

    control.weighted := VecInit(Seq(0, 1, 2).map(corner => in(weighted.filter(_ % 3 == corner))))
    control.slope    := VecInit(slopes.flatten.map(at(_)))
    control.raise    := in(raise)
    control.square   := (in(squareNormal) && isFirstLight) || in(squareLight)
    control.project  := in(project)
    control.lengths  := at(lengths)

    control.accumulate := in(sums.flatten.map(_ + 1))
    control.first      := in(sums.map(_.head + 1))
    control.descend    := (if (digits == 1) false.B else in(slopes.flatMap(_.tail).map(_ + 1)))
    control.roundSlope := in(addSlope.map(_ - 1))

    control.addSlope     := in(addSlope)
    control.addDistance  := at(addDistance)
    control.addOffset    := in(addOffset) && isFirstLight
    control.pushNormal   := in(pushNormal)
    control.pushLight    := in(pushLight)
    control.measureLight := in(measureLight)
    control.turn         := VecInit(turn.map(at(_)))

    control.placeLight  := VecInit(placeLight.map(at(_)))
    control.scaleNormal := in(scaleNormal) && isFirstLight
    control.scaleLight  := in(scaleLight)

    control.startMeasure := at(pushNormal.head, measureLight.head)
    control.countNormal  := at(countNormal)
    control.countLight   := at(countLight)

    control.keepNormalLength := at(normalSquared) && isFirstLight
    control.keepDot          := at(projected)
    control
  }
}
