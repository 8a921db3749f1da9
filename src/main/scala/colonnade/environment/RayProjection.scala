package colonnade.environment

import chisel3._
import chisel3.util.Valid
import colonnade.formats.EnvironmentView
import colonnade.microcode.{Exit, Overlap}
import colonnade.numbers.Rounding

/** Projects a ray into the map: (u, v, w) of its origin and along its direction. In this space the ray is straight.
  *
  * A matrix row times a vector is a sum of products of digits, highest digits first. Each component is normalised on
  * its own and then aligned to the largest one; both roundings together are a single floor. A component needs the sum
  * for two cycles: in the first one it is measured, in the second one shifted.
  */
final class RayProjection(m: MarchOperations, view: EnvironmentView, request: MarchRequest) {
  import MarchLabel._
  import m.formats._
  import m.program._

  /** A number as digits of a power of two, the lowest first; unsigned, except for the highest. */
  private class Digits(number: SInt, val bits: Int) {
    private val count = (number.getWidth - 2) / bits + 1
    val values: Seq[SInt] = Seq.tabulate(count) { i =>
      if (i == count - 1) Rounding.floor(number, i * bits) else number(i * bits + bits - 1, i * bits).zext
    }
  }

  /** A product of two digits, in units of 2^log. */
  private class Term(val log: Int, val wide: SInt, val narrow: SInt)

  // The multiplier's wide factor holds digits of the registers, the narrow one digits of the ray
  private def ofView(number: SInt): Digits = new Digits(number, wideBits - 1)
  private def ofRay(number:  SInt): Digits = new Digits(number, narrowBits - 1)

  private val matrix      = view.matrix.map(_.axes.map(ofView))
  private val offset      = view.offset.axes.map(ofView)
  private val offsetPower = {
    val isMax = view.offsetShift >= sceneBits.U // a larger shift counts as this one
    ofRay((isMax ## (1.U(1.W) << view.offsetShift)(sceneBits - 1, 0)).zext)
  }
  private val origin       = request.ray.origin.axes.map(component => ofRay(component.integer))
  private val direction    = request.ray.dir.axes.map(ofRay)
  private val inverseDepth = m.quotient.zext

  /** Steps that project the ray. They end at `Finish` if the origin is behind the camera, and at `BoundingPlanes` if it
    * is outside the map.
    */
  def describe(dda: DdaSetup): Unit = {
    matrixProduct(ProjectOrigin, m.uvwOrigin, m.uvwOriginExponent)(axis =>
      terms(matrix(axis), origin) ++ terms(Seq(offset(axis)), Seq(offsetPower))
    )(ProjectDir.when(request.isFromCamera, "from a camera"))
    step(OriginDepth) {
      m.load(m.uvwOrigin(2))
      branch(Finish.when(m.uvwOrigin(2) <= 0.S, "behind the camera"))
    }
    step(m.normalise())
    step {
      m.startDivision(m.one, m.sumMantissa)
      set(m.depthMantissa, m.sumMantissa)
      set(m.depthExponent, m.exponent)
      branch(UvwRay.when(request.isFromCamera, "from a camera"))
    }
    matrixProduct(ProjectDir, m.projectedDir, m.projectedDirExponent)(axis => terms(matrix(axis), direction))(
      ClipPlane.when(request.isFromCamera, "from a camera")
    )
    label(UvwRay)
    overlap { at =>
      at(0) {
        m.load(inverseDepth)
        m.awaitDivision()
      }
      uvwOrigin(at)
      for ((axis, index) <- Seq(2, 0, 1).zipWithIndex) uvwDir(at, axis, begin = 5 + 2 * index, isFirst = index == 0)
      dda.firstTile(at, begin = 7)
      align(at, m.uvwDir, m.uvwDirExponent, begin = 13)
      at(16)(branch(BoundingPlanes.when(dda.isOutside, "outside the map")))
    }
  }

  /** The origin's w, which is the inverse depth, then u and v. Seven cycles. */
  private def uvwOrigin(at: Overlap[MarchLabel]): Unit = {
    at(1) {
      m.latchExponent()
      m.setShift(m.depthExponent.zext +& m.uvwOriginExponent.zext - view.exponent - 1.S)
    }
    at(2)(set(m.uvwOrigin(2), m.coordinate))
    for (axis <- 0 to 1) {
      val begin = 1 + 2 * axis
      at(begin)(m.multiply(m.uvwOrigin(axis), inverseDepth))
      at(begin + 1)(m.load(m.product))
      at(begin + 2) {
        m.latchExponent()
        m.setShift(m.depthExponent.zext +& (f - 1).S)
      }
      at(begin + 3)(set(m.uvwOrigin(axis), m.coordinate))
    }
    at(3)(m.takeQuotient())
  }

  /** The change of (u, v, w), times the depth: projectedDir − uvwOrigin · projectedDir₂; for w without the first term.
    * Four cycles.
    */
  private def uvwDir(at: Overlap[MarchLabel], axis: Int, begin: Int, isFirst: Boolean): Unit = {
    at(begin)(m.multiply(m.uvwOrigin(axis), m.projectedDir(2)))
    at(begin + 1) {
      if (axis == 2) m.loadSigned(m.product) else m.loadDifference((m.projectedDir(axis) << f).asSInt, m.product)
    }
    normalise(at, m.uvwDir, m.uvwDirExponent, axis, begin + 2, isFirst)
  }

  /** In a step before `ProjectOrigin`: the least exponent of the origin's block, which for a camera also holds the
    * depth of the near plane. Or the camera's origin, if it is known.
    */
  def clear(camera: Valid[CameraOrigin]): Unit = {
    val most  = ((BigInt(1) << exponentBits) - 1).U
    val next  = (view.exponent +& 1.S(2.W)).asUInt
    val some  = if (view.exponent.getWidth > exponentBits) Mux(next > most, most, next) else next
    val least = Mux(camera.valid, camera.bits.exponent, Mux(view.exponent >= 0.S, some, 0.U))
    set(m.uvwOriginExponent, Mux(request.isFromCamera, least, 0.U))
    for ((to, from) <- m.uvwOrigin.zip(camera.bits.origin)) set(to, from.pad(originBits))
  }

  /** The matrix times a vector: a row begins one cycle after the sum of the row before. */
  private def matrixProduct(name: MarchLabel, vector: Vec[SInt], maxExponent: UInt)(row: Int => Seq[Term])(
      exit: => Exit[MarchLabel]
  ): Unit = {
    label(name)
    overlap { at =>
      val end = (0 until 3).foldLeft(0) { (begin, axis) =>
        val terms = row(axis).sortBy(-_.log)
        for ((term, index) <- terms.zipWithIndex) {
          at(begin + index)(m.multiply(term.wide, term.narrow))
          at(begin + index + 1) {
            if (index == 0) m.load(m.product)
            else m.shiftAccumulate(terms(index - 1).log - term.log)
          }
        }
        val next = begin + terms.size + 1
        normalise(at, vector, maxExponent, axis, next, isFirst = axis == 0 && !(vector eq m.uvwOrigin))
        next
      }
      align(at, vector, maxExponent, begin = end + 2)
      at(end + 5)(branch(exit))
    }
  }

  /** Makes a component from the sum that is ready at `begin`. Two cycles. */
  private def normalise(
      at:          Overlap[MarchLabel],
      vector:      Vec[SInt],
      maxExponent: UInt,
      axis:        Int,
      begin:       Int,
      isFirst:     Boolean
  ): Unit = {
    at(begin)(m.normalise())
    at(begin + 1) {
      set(vector(axis), component(vector))
      set(m.exponents(axis), m.exponent)
      set(maxExponent, m.exponent, isFirst.B || m.exponent > maxExponent)
    }
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

  /** The products of two rows of numbers. */
  private def terms(left: Seq[Digits], right: Seq[Digits]): Seq[Term] = for {
    (a, b)      <- left.zip(right)
    (wide, i)   <- a.values.zipWithIndex
    (narrow, j) <- b.values.zipWithIndex
  } yield new Term(i * a.bits + j * b.bits, wide, narrow)
}
