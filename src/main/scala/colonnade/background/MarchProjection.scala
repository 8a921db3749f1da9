package colonnade.background

import chisel3._
import colonnade.config.ColonnadeConfig
import colonnade.formats.RoomView
import colonnade.numbers.Rounding

/** Projects a ray: (u, v, w) of its origin and along its direction, in which it is straight.
  *
  * A row of the matrix times a position is a sum of products of digits, highest first. Components are normalised each on
  * its own and then aligned to the longest; to floor twice is to floor once.
  */
final class MarchProjection(config: ColonnadeConfig, m: MarchDatapath, view: RoomView, request: MarchRequest) {
  import m.formats._
  import m.program._

  private val matrixRow   = VecInit(view.matrix.map(row => VecInit(row.axes)))(m.axis)
  private val offset      = VecInit(view.offset.axes)(m.axis)
  private val offsetPower = 1.U(1.W) << view.offsetShift
  private val origin      = request.ray.origin.axes.map(_.integer)

  /** Steps that scale the direction, the first ones for every ray; they jump to "seen" for one from the camera. */
  def describeHeading(): Unit = {
    step {
      set(m.axis, 0.U)
      set(m.towardsTop, 0.U)
    }
    step("heading")(m.load(VecInit(request.ray.towards.axes)(m.axis)))
    normalise("heading", m.heading, m.towardsTop)
    step(branch(request.isSeen -> "seen"))
  }

  /** Steps that leave the last row of the matrix, times the direction, in the sum. */
  def describeDepth(): Unit = {
    step(set(m.axis, 2.U))
    row(terms(m.heading))
  }

  /** Steps for a ray whose direction is to be marched along; jumps if its origin is behind the camera. */
  def describe(behind: String): Unit = {
    val offsetTerm = (offset, digitsOf(offsetPower.zext))
    block("origin", m.place, m.placeTop)(terms(origin) :+ offsetTerm)
    block("direction", m.towards, m.towardsTop)(terms(m.heading))
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
    m.divide(m.one, m.mantissa)
    position()
    direction()
  }

  /** u and v; w is the inverse depth itself. */
  private def position(): Unit = {
    step(set(m.axis, 0.U))
    step("position")(m.multiply(m.place(m.axis), m.quotient.zext))
    step(m.load(m.product))
    step {
      set(m.length, m.measured)
      set(m.drop, m.depthLength.zext +& (f - 1).S)
    }
    step {
      set(m.place(m.axis), m.saturated(alongBits))
      next("position", 1)
    }
    step(m.load(m.quotient.zext))
    step {
      m.measure()
      set(m.drop, m.depthLength.zext +& m.placeTop.zext - view.exponent - 1.S)
    }
    step {
      set(m.place(2), m.saturated(alongBits))
      set(m.axis, 0.U)
      set(m.wayTop, 0.U)
    }
  }

  /** The change of (u, v, w), times the depth's: (towards − place · towards₂), and of w without the first. */
  private def direction(): Unit = {
    step("way")(m.multiply(m.place(m.axis), m.towards(2)))
    step(m.load(Mux(m.axis === 2.U, 0.S, (m.towards(m.axis) << f).asSInt)))
    step(m.accumulate(subtract = true))
    normalise("way", m.way, m.wayTop)
  }

  /** A row of the matrix times a vector, for every row. */
  private def block(name: String, vector: Vec[SInt], top: UInt)(factors: Seq[(SInt, Seq[SInt])]): Unit = {
    step {
      set(m.axis, 0.U)
      set(top, 0.U)
    }
    label(name)
    row(factors)
    normalise(name, vector, top)
  }

  /** The sum of products, digit by digit. */
  private def row(factors: Seq[(SInt, Seq[SInt])]): Unit = {
    val products = for {
      ((entry, vectorDigits), _) <- factors.zipWithIndex
      (entryDigit, i)            <- digitsOf(entry).zipWithIndex
      (vectorDigit, j)           <- vectorDigits.zipWithIndex
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

  /** Makes a component of the sum, and goes on with the next; in the end aligns all three. */
  private def normalise(name: String, vector: Vec[SInt], top: UInt): Unit = {
    step(m.measure())
    step {
      set(vector(m.axis), Rounding.narrow(m.shifted, f + 1).pad(vector(0).getWidth))
      set(m.lengths(m.axis), m.length)
      set(top, m.length, m.length > top)
      next(name, 2)
    }
    step(s"$name aligned") {
      m.load(vector(m.axis))
      set(m.drop, top.zext +& f.S - m.lengths(m.axis).zext)
    }
    step {
      set(vector(m.axis), Rounding.narrow(m.shifted, f + 1).pad(vector(0).getWidth))
      next(s"$name aligned", 2)
    }
  }

  /** The same for the next axis, if this is not the last one. */
  private def next(name: String, last: Int): Unit = {
    val isLast = m.axis === last.U
    set(m.axis, Mux(isLast, 0.U, m.axis + 1.U))
    branch(!isLast -> name)
  }

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
