package colonnade.environment

import chisel3._
import colonnade.config.ColonnadeConfig
import colonnade.formats.RoomView
import colonnade.numbers.Rounding

/** Projects a ray: (u, v, w) of its origin and along its direction, in which it is straight.
  *
  * A row of the matrix times a position is a sum of products of digits, highest first. Components are normalised each on
  * its own and then aligned to the longest; to floor twice is to floor once. The sum is free again two cycles after it
  * is there: in the first it is measured, in the second shifted.
  */
final class MarchProjection(config: ColonnadeConfig, m: MarchDatapath, view: RoomView, request: MarchRequest) {
  import m.formats._
  import m.program._

  private val matrixRow   = VecInit(view.matrix.map(row => VecInit(row.axes)))(m.axis)
  private val offset      = VecInit(view.offset.axes)(m.axis)
  private val offsetPower = {
    val isMost = view.offsetShift >= sceneBits.U // and above it counts as that
    isMost ## (1.U(1.W) << view.offsetShift)(sceneBits - 1, 0)
  }
  private val origin  = request.ray.origin.axes.map(_.integer)
  private val inverse = m.quotient.zext

  /** Steps that scale the direction, the first ones for every ray; they jump to "seen" for one from the camera. */
  def describeHeading(): Unit = overlap { at =>
    for ((component, axis) <- request.ray.towards.axes.zipWithIndex) {
      at(2 * axis)(m.load(component))
      normalise(at, m.heading, m.towardsTop, axis, begin = 2 * axis + 1)
    }
    align(at, m.heading, m.towardsTop, begin = 7)
    at(10) {
      set(m.axis, 0.U)
      branch(request.isSeen -> "seen")
    }
  }

  /** Steps that leave a row of the matrix, that of `axis`, times the direction in the sum. */
  def describeTowards(): Unit = row(terms(m.heading))

  /** Steps for a ray whose direction is to be marched along; jumps if its origin is behind the camera. */
  def describe(behind: String): Unit = {
    val offsetTerm = (offset, digitsOf(offsetPower.zext))
    block("origin", m.place, m.placeTop)(terms(origin) :+ offsetTerm)
    step {
      m.load(m.place(2))
      branch((m.place(2) <= 0.S) -> behind)
    }
    step(m.measure())
    step {
      set(m.mantissa, m.shifted.asUInt(f - 1, 0))
      set(m.depthMantissa, m.shifted.asUInt(f - 1, 0))
      set(m.depthLength, m.length)
    }
    step(m.startDivision(m.one, m.mantissa))
    block("direction", m.towards, m.towardsTop)(terms(m.heading))
    m.awaitDivision()
    overlap { at =>
      position(at)
      for (axis <- 0 until 3) direction(at, axis, begin = 6 + 3 * axis)
      align(at, m.way, m.wayTop, begin = 17)
    }
  }

  /** u and v; w is the inverse depth itself. Eight cycles. */
  private def position(at: Overlap): Unit = {
    for (axis <- 0 to 1) {
      val begin = 2 * axis
      at(begin)(m.multiply(m.place(axis), inverse))
      at(begin + 1)(m.load(m.product))
      at(begin + 2) {
        set(m.length, m.measured)
        set(m.drop, m.depthLength.zext +& (f - 1).S)
      }
      at(begin + 3)(set(m.place(axis), m.saturated(alongBits)))
    }
    at(5)(m.load(inverse))
    at(6) {
      set(m.length, m.measured)
      set(m.drop, m.depthLength.zext +& m.placeTop.zext - view.exponent - 1.S)
    }
    at(7)(set(m.place(2), m.saturated(alongBits)))
  }

  /** The change of (u, v, w), times the depth's: (towards − place · towards₂), and of w without the first. Five cycles. */
  private def direction(at: Overlap, axis: Int, begin: Int): Unit = {
    at(begin)(m.multiply(m.place(axis), m.towards(2)))
    at(begin + 1)(m.load(if (axis == 2) 0.S else (m.towards(axis) << f).asSInt))
    at(begin + 2)(m.accumulate(subtract = true))
    normalise(at, m.way, m.wayTop, axis, begin + 3)
  }

  /** A row of the matrix times a vector, for every row; `axis` is 0 before and after. */
  private def block(name: String, vector: Vec[SInt], top: UInt)(factors: Seq[(SInt, Seq[SInt])]): Unit = {
    label(name)
    row(factors)
    step(m.measure())
    step {
      keep(vector, top, m.axis)
      set(m.axis, Mux(m.axis === 2.U, 0.U, m.axis + 1.U))
      branch((m.axis =/= 2.U) -> name)
    }
    overlap(align(_, vector, top, begin = 0))
  }

  /** The sum of products, digit by digit. */
  private def row(factors: Seq[(SInt, Seq[SInt])]): Unit = {
    val products = for {
      (entry, vectorDigits) <- factors
      (entryDigit, i)       <- digitsOf(entry).zipWithIndex
      (vectorDigit, j)      <- vectorDigits.zipWithIndex
    } yield (i + j, vectorDigit, entryDigit)
    val ordered = products.sortBy(-_._1)
    for (((weight, wide, narrow), index) <- ordered.zipWithIndex)
      step {
        m.multiply(wide, narrow)
        if (index > 0) add(index - 1)
      }
    step(add(ordered.size - 1))

    def add(index: Int): Unit =
      if (index == 0) m.load(m.product)
      else if (ordered(index)._1 < ordered(index - 1)._1) m.descend()
      else m.accumulate()
  }

  /** Makes a component of the sum that is there at `begin`. Two cycles. */
  private def normalise(at: Overlap, vector: Vec[SInt], top: UInt, axis: Int, begin: Int): Unit = {
    at(begin)(m.measure())
    at(begin + 1)(keep(vector, top, axis.U(2.W)))
  }

  /** In the step after the sum is measured. */
  private def keep(vector: Vec[SInt], top: UInt, axis: UInt): Unit = {
    set(vector(axis), component(vector))
    set(m.lengths(axis), m.length)
    set(top, m.length, axis === 0.U || m.length > top)
  }

  /** Aligns components to the longest. Four cycles. */
  private def align(at: Overlap, vector: Vec[SInt], top: UInt, begin: Int): Unit =
    for (axis <- 0 until 3) {
      at(begin + axis) {
        m.load(vector(axis))
        set(m.drop, top.zext +& f.S - m.lengths(axis).zext)
      }
      at(begin + axis + 1)(set(vector(axis), component(vector)))
    }

  private def component(vector: Vec[SInt]): SInt = Rounding.narrow(m.shifted, f + 1).pad(vector(0).getWidth)

  private def terms(vector: Seq[SInt]): Seq[(SInt, Seq[SInt])] =
    vector.zipWithIndex.map { case (component, column) => (matrixRow(column), digitsOf(component)) }

  def digitsOf(number: SInt): Seq[SInt] = {
    val count = digits(number.getWidth)
    Seq.tabulate(count) { i =>
      if (i == count - 1) Rounding.floor(number, i * digitBits)
      else number(i * digitBits + digitBits - 1, i * digitBits).zext
    }
  }
}
