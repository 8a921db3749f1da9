package colonnade

import org.scalacheck.rng.Seed
import org.scalacheck.{Prop, Test}
import org.scalatest.Assertions
import org.scalatest.exceptions.TestFailedException
import org.scalatestplus.scalacheck.Checkers

/** Properties of random values, with a new seed in each run. A failure names its seed; the environment variable
  * `PROPERTY_SEED` repeats it.
  */
trait Properties extends Checkers { this: Assertions =>

  protected def holds(cases: Int)(property: Prop): Unit = {
    val seed = sys.env.get("PROPERTY_SEED").fold(Seed.random())(Seed.fromBase64(_).get)
    // The failure is converted to text: its values could not be serialised by the forked process
    try check(property, Test.Parameters.default.withMinSuccessfulTests(cases).withInitialSeed(seed))
    catch {
      case failure: TestFailedException => fail(s"with PROPERTY_SEED=${seed.toBase64}: ${failure.getMessage}")
    }
  }
}
