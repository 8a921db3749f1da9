package colonnade.environment

import chisel3._
import colonnade.formats.EnvironmentView
import colonnade.microcode.{Exit, Overlap}
import colonnade.numbers.Rounding

/** Projects a ray into the map: (u, v, w) of its origin and along its direction. In this space the ray is straight.
  *
  * A matrix row times a vector is a sum of products of digits, highest digits first. Each component is normalised on its
  * own and then aligned to the largest one; both roundings together are a single floor. A component needs the sum for
  * two cycles: in the first one it is measured, in the second one shifted.
  */
final class RayProjection(m: MarchOperations, view: EnvironmentView, request: MarchRequest) {
  import MarchLabel._
  import m.formats._
  import m.program._

  // What `m.axis` selects: a row of the matrix, and of the offset. Registers, because a multiplication follows
  private val matrixRow   = Reg(Vec(3, chiselTypeOf(view.matrix.head.x)))
  private val offset      = Reg(chiselTypeOf(view.offset.axes.head))
  private val offsetPower = {
    val isMax = view.offsetShift >= sceneBits.U // a larger shift counts as this one
    isMax ## (1.U(1.W) << view.offsetShift)(sceneBits - 1, 0)
  }
  private val origin       = request.ray.origin.axes.map(_.integer)
  private val inverseDepth = m.quotient.zext

  /** In a step: selects an axis, and its row of matrix and offset. */
  def selectRow(axis: UInt): Unit = {
    set(m.axis, axis)
    val selected = VecInit(view.matrix.map(row => VecInit(row.axes)))(axis)
    for ((entry, column) <- matrixRow.zipWithIndex) set(entry, selected(column))
    set(offset, VecInit(view.offset.axes)(axis))
  }

  /** Steps that project the ray. They end at `Finish` if the origin is behind the camera. */
  def describe(): Unit = {
    val offsetTerm = (offset, digitsOf(offsetPower.zext))
    matrixProduct(ProjectOrigin, m.uvwOrigin, m.uvwOriginExponent)(terms(origin) :+ offsetTerm) {
      ProjectDir.when(request.isFromCamera, "from a camera")
    }
    step(OriginDepth) {
      m.load(m.uvwOrigin(2))
      branch(Finish.when(m.uvwOrigin(2) <= 0.S, "behind the camera"))
    }
    step(m.normalise())
    step {
      set(m.mantissa, m.sumMantissa)
      set(m.depthMantissa, m.sumMantissa)
      set(m.depthExponent, m.exponent)
    }
    step {
      m.startDivision(m.one, m.mantissa)
      branch(UvwRay.when(request.isFromCamera, "from a camera"))
    }
    matrixProduct(ProjectDir, m.projectedDir, m.projectedDirExponent)(terms(request.ray.dir.axes)) {
      NearPlane.when(request.isFromCamera, "from a camera")
    }
    label(UvwRay)
    m.awaitDivision()
    overlap { at =>
      uvwOrigin(at)
      for (axis <- 0 until 3) uvwDir(at, axis, begin = 6 + 3 * axis)
      align(at, m.uvwDir, m.uvwDirExponent, begin = 17)
    }
  }

  /** The origin's u and v; w is the inverse depth. Eight cycles. */
  private def uvwOrigin(at: Overlap[MarchLabel]): Unit = {
    for (axis <- 0 to 1) {
      val begin = 2 * axis
      at(begin)(m.multiply(m.uvwOrigin(axis), inverseDepth))
      at(begin + 1)(m.load(m.product))
      at(begin + 2) {
        m.latchExponent()
        m.setShift(m.depthExponent.zext +& (f - 1).S)
      }
      at(begin + 3)(set(m.uvwOrigin(axis), m.coordinate))
    }
    at(5)(m.load(inverseDepth))
    at(6) {
      m.latchExponent()
      m.setShift(m.depthExponent.zext +& m.uvwOriginExponent.zext - view.exponent - 1.S)
    }
    at(7)(set(m.uvwOrigin(2), m.coordinate))
  }

  /** The change of (u, v, w), times the depth: projectedDir − uvwOrigin · projectedDir₂; for w without the first term. Five
    * cycles.
    */
  private def uvwDir(at: Overlap[MarchLabel], axis: Int, begin: Int): Unit = {
    at(begin)(m.multiply(m.uvwOrigin(axis), m.projectedDir(2)))
    at(begin + 1)(m.load(if (axis == 2) 0.S else (m.projectedDir(axis) << f).asSInt))
    at(begin + 2)(m.accumulate(subtract = true))
    normalise(at, m.uvwDir, m.uvwDirExponent, axis, begin + 3)
  }

  /** In a step before `ProjectOrigin`: its first row, and the least exponent of the origin's block, which for a camera also holds the depth of
    * the near plane.
    */
  def clear(): Unit = {
    selectRow(0.U)
    val most = ((BigInt(1) << exponentBits) - 1).U
    val next = (view.exponent +& 1.S(2.W)).asUInt
    val some = if (view.exponent.getWidth > exponentBits) Mux(next > most, most, next) else next
    set(m.uvwOriginExponent, Mux(request.isFromCamera && view.exponent >= 0.S, some, 0.U))
  }

  /** The matrix times a vector, row by row; `axis` is 0 before and after. */
  private def matrixProduct(name: MarchLabel, vector: Vec[SInt], maxExponent: UInt)(
      factors: Seq[(SInt, Seq[SInt])]
  )(exit: => Exit[MarchLabel]): Unit = {
    label(name)
    row(factors)
    step(m.normalise())
    step {
      latch(vector, maxExponent, m.axis)
      selectRow(Mux(m.axis === 2.U, 0.U, m.axis + 1.U))
      branch(name.when(m.axis =/= 2.U, "next row"))
    }
    overlap { at =>
      align(at, vector, maxExponent, begin = 0)
      at(3)(branch(exit))
    }
  }

  /** A sum of products, digit by digit. */
  private def row(factors: Seq[(SInt, Seq[SInt])]): Unit = {
    val products = for {
      (entry, vectorDigits) <- factors
      (entryDigit, i)       <- digitsOf(entry).zipWithIndex
      (vectorDigit, j)      <- vectorDigits.zipWithIndex
    } yield (i + j, vectorDigit, entryDigit)
    val ordered = products.sortBy(-_._1)
    for (((_, wide, narrow), index) <- ordered.zipWithIndex)
      step {
        m.multiply(wide, narrow)
        if (index > 0) add(index - 1)
      }
    step(add(ordered.size - 1))

    def add(index: Int): Unit =
      if (index == 0) m.load(m.product)
      else if (ordered(index)._1 < ordered(index - 1)._1) m.shiftAccumulate()
      else m.accumulate()
  }

  /** Makes a component from the sum that is ready at `begin`. Two cycles. */
  private def normalise(at: Overlap[MarchLabel], vector: Vec[SInt], maxExponent: UInt, axis: Int, begin: Int): Unit = {
    at(begin)(m.normalise())
    at(begin + 1)(latch(vector, maxExponent, axis.U(2.W)))
  }

  /** In the step after the sum is normalised. */
  private def latch(vector: Vec[SInt], maxExponent: UInt, axis: UInt): Unit = {
    set(vector(axis), component(vector))
    set(m.exponents(axis), m.exponent)
    set(maxExponent, m.exponent, (axis === 0.U && !(vector eq m.uvwOrigin).B) || m.exponent > maxExponent)
  }

  /** Aligns components to the largest one. Four cycles. */
  private def align(at: Overlap[MarchLabel], vector: Vec[SInt], maxExponent: UInt, begin: Int): Unit =
    for (axis <- 0 until 3) {
      at(begin + axis) {
        m.load(vector(axis))
        m.setShift(maxExponent.zext +& f.S - m.exponents(axis).zext)
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
