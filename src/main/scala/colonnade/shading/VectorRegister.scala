package colonnade.shading

import chisel3._
import colonnade.numbers.Rounding

/** A vector of three signed components in registers that rotate. Its user reads component 0 and rotates the vector. After
  * three uses each component is back in its place, so no component is ever selected.
  */
private[shading] object VectorRegister {
  def apply(bits: Int): Vec[SInt] = Reg(Vec(3, SInt(bits.W)))

  /** Components 1 and 2 move down, and this one enters behind them: a new component, or component 0 again. */
  def rotate(vector: Vec[SInt], entering: SInt): Unit = {
    vector(0) := vector(1)
    vector(1) := vector(2)
    vector(2) := Rounding.narrow(entering, vector(2).getWidth)
  }
}
